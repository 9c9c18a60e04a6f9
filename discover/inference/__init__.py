"""What fits of a forward model are worth: one criterion, for a loop and for a comparison."""
