"""The spectral gap of a law: the methods, the verdict, and the spectrum that carries it."""
