"""Laws with an equation of their own, one file a law or a family."""
