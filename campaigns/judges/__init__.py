"""What judges campaigns and tests: second methods that share no formula with the library, most in many digits."""
