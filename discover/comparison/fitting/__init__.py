"""What is fitted: the learners, the classical laws, the constants of a known part."""
