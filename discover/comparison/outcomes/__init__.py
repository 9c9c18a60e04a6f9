"""What each learner gave, on flows that neither saw."""
