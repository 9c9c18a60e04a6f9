"""The pages of data: what a folder holds, and how temperatures were brought together."""
