"""From a law to its matrix: one protocol, one file a method, and the choice between them."""
