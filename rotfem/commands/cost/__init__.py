"""What accuracy costs: settings are tried and measured, the front of them is reported, the best one tuned in."""
