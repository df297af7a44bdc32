"""Where a simulator is wrong: residual, location, identified effects, corrected model, proof."""
