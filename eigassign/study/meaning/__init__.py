"""What an answer means: what it hangs on, what can be reached, what deviations do.

Reading order:

    sensitivity  slopes of the targeted frequencies at the answer, and what its limits cost
    reach        what each target can reach within the bounds, and which cannot be reached
    tolerance    what deviations of the parameters do to an answer
    levers       where a missed mode has its energy, and what other properties do to it
    overall      all of it, as far as the user asks for it
"""
