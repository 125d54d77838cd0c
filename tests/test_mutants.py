"""The list of deliberate errors does not rot: ``python tests/mutants.py`` makes them."""

import mutants


def test_every_mutant_is_found_once_in_the_package():
    assert mutants.misplaced() == []


def test_mutants_are_many_and_differ():
    assert len(mutants.MUTANTS) >= 44
    assert len({mutant.name for mutant in mutants.MUTANTS}) == len(mutants.MUTANTS)
    assert all(mutant.old != mutant.new for mutant in mutants.MUTANTS)


def test_the_tests_that_mutants_name_are_there():
    tests = mutants.TOP / "tests"
    for mutant in mutants.MUTANTS:
        assert (tests / "reported" / f"test_reported_{mutant.part}.py").exists()
        assert not mutant.more or list(tests.rglob(mutant.more))
