"""The entries of the ledger on geometry: coordinates, the disk's frame, its configuration space, rigid collision."""
