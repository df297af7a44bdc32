"""What ``fly`` does apart from one flight: requests, pilots, the audit afterwards, campaigns and fleets."""
