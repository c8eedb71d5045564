"""Interactive viewing and teleoperation of tasks, in MuJoCo's viewer or in a browser."""
