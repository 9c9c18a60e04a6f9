"""What a learner answers: terms, their weights, and the table of both."""
