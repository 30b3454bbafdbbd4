"""From measurements to a profile: what the measurements are worth, which model, what to measure next."""
