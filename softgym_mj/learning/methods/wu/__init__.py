"""Wu et al.: pick and place by pixels."""
