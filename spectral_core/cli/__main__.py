"""``python -m spectral_core.cli``."""

import sys

from spectral_core.cli.main import main

sys.exit(main())
