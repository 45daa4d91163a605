"""Gap studies: quantities of families of laws over grids of parameters, with errors and checkpoints."""
