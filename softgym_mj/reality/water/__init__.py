"""Dam breaks and sloshing tanks, simulated against recordings."""
