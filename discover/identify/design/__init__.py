"""What to measure next, and what a measurement then says of the laws."""
