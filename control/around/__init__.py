"""What stands around any law, shipped or its user's, each part off unless asked for."""
