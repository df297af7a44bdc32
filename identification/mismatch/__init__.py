"""Where a simulator is wrong: residual, location, name, corrected model, proof."""
