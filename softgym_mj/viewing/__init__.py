"""Looking at tasks and playing them by hand, in MuJoCo's viewer or in a browser."""
