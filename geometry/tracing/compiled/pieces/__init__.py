"""The formulas of the pieces of a wall, in doubles and in double-doubles, and what the loops over rays share."""
