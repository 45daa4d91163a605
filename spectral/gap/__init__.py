"""The spectral gap and the spectrum of a law: methods, theorems and verdict."""
