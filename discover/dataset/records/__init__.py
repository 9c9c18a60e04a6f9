"""What is told of records and done to them before they are fitted."""
