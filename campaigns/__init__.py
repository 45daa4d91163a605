"""What developers measure besides ``asperity bench``: speed, goals, peers; ``python -m campaigns`` runs all."""
