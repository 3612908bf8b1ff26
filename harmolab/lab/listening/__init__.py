"""User studies: trials, presenting, answers, analysis."""
