"""The tensor-basis neural network inside the differential equation."""

from discover.learners.tbnn_ude.estimator import TBNNUDE
from discover.learners.tbnn_ude.problem import DefaultRecipe
from discover.learners.tbnn_ude.recipes import PaperRecipe

__all__ = ["TBNNUDE", "DefaultRecipe", "PaperRecipe"]
