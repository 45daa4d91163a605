"""How functions are compiled that trace rays, and the tables that they read."""
