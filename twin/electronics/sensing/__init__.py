"""The way in: from joint angles to what the controller is handed, one stage a file."""
