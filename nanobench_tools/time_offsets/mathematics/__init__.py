"""Mathematics of time offsets between two signals: arrays in, numbers out; nothing here knows of flights or streams."""
