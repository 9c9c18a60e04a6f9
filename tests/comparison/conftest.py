"""What the tests of comparisons share."""

import sys
from pathlib import Path

# data behind an instrument, made by scipy
sys.path.append(str(Path(__file__).parent))
