"""Speed: the goals and what is reached, other programs in the same run, and the references of the standard set."""
