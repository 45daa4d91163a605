"""What developers measure besides ``asperity bench``: speed, goals, peers; ``python -m benchmarks`` runs all."""
