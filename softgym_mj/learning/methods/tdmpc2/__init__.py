"""TD-MPC2."""
