"""What an answer means: what it hangs on, what can be reached, what deviations do.

Reading order:

    reach    what each target can reach within the bounds; what deviations of the parameters do
    overall  all of it, as far as the user asks for it; slopes of what is wanted, modes that miss it
"""
