"""The spectral gap and the spectrum of a law: the methods, the theorems and the verdict."""
