"""What an answer means: what it hangs on, what can be reached, what deviations do.

Reading order:

    sensitivity  slopes of the targeted frequencies; where a missed mode has its energy
    reach        what each target can reach within the bounds, and which cannot be reached
    tolerance    what deviations of the parameters do to an answer
    overall      all of it, as far as the user asks for it
"""
