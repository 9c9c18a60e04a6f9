"""Where a run begins that is not from rest: in a steady flow, or in steady alternation."""
