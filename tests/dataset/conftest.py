import sys
from pathlib import Path

# helper modules of this folder: tests are imported by path, not as a package
sys.path.insert(0, str(Path(__file__).parent))
