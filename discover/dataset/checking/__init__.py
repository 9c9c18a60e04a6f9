"""What is wrong or doubtful about data, found before any fit."""
