"""The journal of a supervisor's calls."""
from tactile_servo.journal import Call, Journal, MOST_CALLS


def test_a_journal_that_nobody_takes_stays_small_and_says_what_is_lost():
    journal = Journal()
    for k in range(MOST_CALLS + 5):
        journal.add(Call.CYCLE, value=k)
    taken = journal.take()
    assert taken.first == MOST_CALLS
    assert list(taken.value) == list(range(MOST_CALLS, MOST_CALLS + 5))
    assert journal.first == MOST_CALLS + 5 and not journal.call
