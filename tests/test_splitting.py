"""Splits: exactly the rows that the rule names, and no pose on both sides."""

import numpy as np
import pandas as pd
import pytest

from truearm.errors import InputError, UsageError
from truearm.fits.core_set import distance_count
from truearm.fits.options import CalibrationOptions
from truearm.measurements import Measurements
from truearm.rows.linked_pairs import pairs_between
from truearm.rows.splitting import HoldoutRange, SplitRule, split_rows


def table(count, *, seed=0, **columns):
    rng = np.random.default_rng(seed)
    readings = {f"q{j}": rng.uniform(-1.0, 1.0, count) for j in (1, 2, 3)}
    return pd.DataFrame({**readings, "x": rng.normal(size=count), "y": 0.0, "z": 1.0, **columns})


def measured(count, name="data", **more):
    return Measurements.from_dataframe(table(count, **more), name=name)


@pytest.mark.parametrize(
    ("count", "holdout", "seed"), [(10, 0.3, 7), (101, 0.3, 7), (101, 0.25, 0), (33, 0.9, 5)]
)
def test_plain_split_is_one_permutation(count, holdout, seed):
    order = np.random.default_rng(seed).permutation(count)
    held = int((1 - holdout) * count)
    split = split_rows(measured(count), SplitRule(holdout=holdout, seed=seed))
    np.testing.assert_array_equal(split.train, order[:held])
    np.testing.assert_array_equal(split.holdout, order[held:])


def test_train_size_takes_the_first_of_the_permutation():
    order = np.random.default_rng(7).permutation(100)
    split = split_rows(measured(100), SplitRule(train_size=20))
    np.testing.assert_array_equal(split.train, order[:20])
    np.testing.assert_array_equal(split.holdout, order[70:])


def test_each_file_is_split_for_itself():
    data = Measurements.concatenate([measured(50, "a"), measured(40, "b", seed=1)])
    split = split_rows(data, SplitRule(train_size=10))
    first, second = (np.random.default_rng(7).permutation(count) for count in (50, 40))
    np.testing.assert_array_equal(split.train, [*first[:10], *(50 + second[:10])])
    np.testing.assert_array_equal(split.holdout, [*first[35:], *(50 + second[28:])])


def test_a_train_size_up_to_the_held_out_rows_is_taken_and_one_more_is_refused():
    assert len(split_rows(measured(100), SplitRule(train_size=70)).train) == 70
    with pytest.raises(UsageError, match=r"71 reaches into the held-out rows.*30 are held out.*at most 70"):
        split_rows(measured(100), SplitRule(train_size=71))


def test_split_by_holds_out_whole_groups():
    place = np.arange(120) % 12
    data = measured(120, place=place * 1.0, layer=place % 2 * 1.0)
    split = split_rows(data, SplitRule(split_by=("layer", "place")))
    rng = np.random.default_rng(7)
    keys = np.unique(np.column_stack([place % 2, place]), axis=0)
    drawn = {tuple(key) for key in keys[rng.permutation(12)[int(0.7 * 12) :]]}
    held = np.array([(p % 2, p) in drawn for p in place])
    np.testing.assert_array_equal(split.train, rng.permutation(np.flatnonzero(~held)))
    assert set(split.holdout) == set(np.flatnonzero(held))
    assert not set(place[split.train]) & set(place[split.holdout])


def test_split_by_with_a_train_size_keeps_the_held_out_groups():
    data = measured(120, place=np.arange(120) % 12 * 1.0)
    whole = split_rows(data, SplitRule(split_by=("place",)))
    few = split_rows(data, SplitRule(split_by=("place",), train_size=15))
    np.testing.assert_array_equal(few.train, whole.train[:15])
    np.testing.assert_array_equal(few.holdout, whole.holdout)


def test_split_by_a_joint_or_the_group():
    data = measured(60, group=[f"g{k % 6}" for k in range(60)])
    with pytest.raises(InputError, match="of which no row trains|no row of the set-up"):
        split_rows(data, SplitRule(split_by=("group",)))


@pytest.mark.parametrize(("text", "high"), [("q2:high:0.3", True), ("q2:low:0.3", False)])
def test_range_holds_out_the_tail(text, high):
    data = measured(200)
    split = split_rows(data, SplitRule(holdout_range=HoldoutRange.parse(text)))
    q2 = data.readings[:, 1]
    assert len(split.holdout) == 60
    assert len(split.train) == 140
    if high:
        assert q2[split.holdout].min() > q2[split.train].max()
    else:
        assert q2[split.holdout].max() < q2[split.train].min()


def test_training_rows_beside_a_range_are_a_permutation():
    data = measured(200)
    split = split_rows(data, SplitRule(holdout_range=HoldoutRange(2, True, 0.3)))
    assert not np.array_equal(split.train, np.sort(split.train))
    assert sorted([*split.train, *split.holdout]) == list(range(200))


def test_equal_readings_at_the_range_s_boundary_stay_together():
    data = measured(100, q2=np.repeat(np.linspace(0.0, 1.0, 10), 10))
    split = split_rows(data, SplitRule(holdout_range=HoldoutRange(2, True, 0.25)))
    assert not set(data.readings[split.train, 1]) & set(data.readings[split.holdout, 1])
    assert len(split.holdout) == 30


@pytest.mark.parametrize("rule", [SplitRule(), SplitRule(split_by=("lot",)), SplitRule(train_size=40)])
def test_repeated_joint_vectors_stay_on_one_side(rule):
    frame = table(240, lot=np.arange(240) % 7 * 1.0)
    configuration = np.random.default_rng(3).integers(0, 24, 240)
    for j in (1, 2, 3):
        frame[f"q{j}"] = np.linspace(-1.0, 1.0, 24)[configuration] * j
    split = split_rows(Measurements.from_dataframe(frame), rule)
    assert not set(configuration[split.train]) & set(configuration[split.holdout])
    assert len(split.holdout) > 20
    if rule.train_size is None:
        assert len(split.train) + len(split.holdout) == 240


def test_the_rows_of_a_pair_stay_on_one_side():
    frame = table(100, pair=[f"p{k // 2}" for k in range(100)], distance=1.0).drop(columns=["x", "y", "z"])
    split = split_rows(Measurements.from_dataframe(frame), SplitRule())
    assert not set(split.train // 2) & set(split.holdout // 2)


def test_a_chain_of_pairs_is_parted_and_loses_few_of_them():
    """Ninety-six poses, each measured to the one before and to the next."""
    poses, links = table(96), np.repeat(np.arange(95), 2)
    frame = poses.iloc[links + np.arange(190) % 2].drop(columns=["x", "y", "z"])
    frame = frame.assign(pair=[f"p{link}" for link in links], distance=1.0)
    split = split_rows(Measurements.from_dataframe(frame), SplitRule())
    train, held = set(links[split.train]), set(links[split.holdout])
    assert not train & held
    assert len(split.train) == 2 * len(train)
    assert len(split.holdout) == 2 * len(held)
    assert 15 <= len(held) <= 40
    assert len(train) + len(held) >= 80
    poses_of = [set((links + np.arange(190) % 2)[rows]) for rows in (split.train, split.holdout)]
    assert not poses_of[0] & poses_of[1]


def distances_between(ends):
    """Distances of poses, each of two of them by their numbers."""
    places = np.ravel(ends)
    frame = table(int(places.max()) + 1).iloc[places].drop(columns=["x", "y", "z"])
    pairs = np.repeat([f"p{k}" for k in range(len(ends))], 2)
    return Measurements.from_dataframe(frame.assign(pair=pairs, distance=1.0))


def test_chains_in_several_files_are_parted_each(tmp_path):
    chain = [(k, k + 1) for k in range(20)]
    files = [tmp_path / f"chain{k}.csv" for k in range(6)]
    for file in files:
        places = np.ravel(chain)
        frame = table(21).iloc[places].drop(columns=["x", "y", "z"]) + len(file.name)
        frame["pair"], frame["distance"] = np.repeat([f"p{k}" for k in range(20)], 2), 1.0
        frame["q1"] += 0.1 * files.index(file)
        frame.to_csv(file, index=False)
    data = Measurements.read_files(files)
    split = split_rows(data, SplitRule())
    for file in data.files:
        assert 4 <= (data.sources[split.holdout] == file).sum() <= 16


def test_of_stretches_the_share_is_held_out():
    for seed in range(8):
        split = split_rows(distances_between([(k, k + 1) for k in range(100)]), SplitRule(seed=seed))
        assert 48 <= len(split.holdout) <= 64


def test_a_chain_that_was_measured_in_any_order_loses_few_pairs():
    order = np.random.default_rng(1).permutation(100)
    split = split_rows(distances_between([(k, k + 1) for k in order]), SplitRule())
    assert split.between == 200 - len(split.train) - len(split.holdout) <= 30


def test_pairs_that_neither_train_nor_are_judged_are_counted():
    rng = np.random.default_rng(3)
    data = distances_between([rng.choice(100, 2, replace=False) for _ in range(100)])
    split = split_rows(data, SplitRule())
    (told,) = pairs_between(data, split)
    assert f"{split.between // 2} of 100 distances go from poses that train" in told.message
    assert f"{len(split.holdout) // 2} are judged" in told.message
    chain = distances_between([(k, k + 1) for k in range(100)])
    assert pairs_between(chain, split_rows(chain, SplitRule())) == []


def test_pairs_with_one_row_that_all_share_are_said_to_leave_nothing_to_hold_out():
    frame = table(60).assign(pair=np.repeat([f"p{k}" for k in range(30)], 2), distance=1.0)
    joints = [f"q{k}" for k in (1, 2, 3)]
    frame.loc[frame.index[::2], joints] = frame.loc[frame.index[0], joints].to_numpy()
    with pytest.raises(InputError, match='(?s)rows of a pair are on one side.*"anchor" in place of'):
        split_rows(Measurements.from_dataframe(frame.drop(columns=["x", "y", "z"])), SplitRule(seed=1))


@pytest.mark.parametrize(
    "text", ["q2", "q2:high", "q2:up:0.3", "2:high:0.3", "q0:high:0.3", "q2:high:much", "q2:high:1.5"]
)
def test_ranges_that_are_none(text):
    with pytest.raises(UsageError, match="range to hold out|between 0 and 1"):
        HoldoutRange.parse(text)


def test_a_range_reads_back_as_it_was_written():
    assert str(HoldoutRange.parse("q2:high:0.3")) == "q2:high:0.3"


@pytest.mark.parametrize("wrong", [{"holdout": 0.0}, {"holdout": 1.0}, {"seed": -1}, {"train_size": 0}])
def test_rules_that_cannot_be(wrong):
    with pytest.raises(UsageError):
        SplitRule(**wrong)


def test_columns_and_a_range_exclude_each_other():
    with pytest.raises(UsageError, match="not both"):
        SplitRule(split_by=("place",), holdout_range=HoldoutRange(1, True, 0.3))


def test_an_unknown_column_is_refused_with_the_nearest():
    with pytest.raises(UsageError, match=r'no column "plaec".*"place"'):
        split_rows(measured(20, place=1.0), SplitRule(split_by=("plaec",)))


def test_an_empty_key_is_refused_by_row():
    place = np.arange(20.0)
    place[4] = np.nan
    with pytest.raises(InputError, match=r'"place" is empty in row 5'):
        split_rows(measured(20, place=place), SplitRule(split_by=("place",)))


def test_a_joint_that_is_not_there_is_refused():
    with pytest.raises(UsageError, match=r"joint 4.*3 joints"):
        split_rows(measured(20), SplitRule(holdout_range=HoldoutRange(4, True, 0.3)))


def test_one_row_cannot_be_split():
    with pytest.raises(InputError, match="no row would be left to train on"):
        split_rows(measured(1), SplitRule())


def test_one_value_to_split_by_leaves_nothing_to_train_on():
    with pytest.raises(UsageError, match='all rows are equal in "place".*leave out --split-by'):
        split_rows(measured(20, place=1.0), SplitRule(split_by=("place",)))


def test_a_set_up_without_training_rows_is_refused():
    group = ["morning"] * 190 + ["evening"] * 10
    for rule, less in (
        (SplitRule(train_size=5), "larger --train-size"),
        (SplitRule(holdout=0.98), "smaller --holdout"),
    ):
        with pytest.raises(InputError, match=rf'no row of the set-up "evening" trains.*a {less}'):
            split_rows(measured(200, group=group), rule)


def planned(count, every=5, **more):
    return measured(count, purpose=["validate" if k % every == 0 else "train" for k in range(count)], **more)


def test_a_set_up_that_was_planned_to_validate_as_a_whole_is_told_so():
    group, purpose = np.repeat(["a", "b"], [20, 10]), np.repeat(["train", "validate"], [20, 10])
    data = measured(30, group=list(group), purpose=list(purpose))
    with pytest.raises(InputError, match='set-up "b" trains.*marked "validate".*mark some "train"') as raised:
        split_rows(data, SplitRule())
    assert "smaller" not in str(raised.value)


def test_poses_that_were_planned_to_validate_are_held_out():
    data = planned(50)
    assert data.notices == ()
    split = split_rows(data, SplitRule())
    assert sorted(split.holdout) == list(range(0, 50, 5))
    assert sorted(split.train) == [k for k in range(50) if k % 5]
    assert split.planned == 10
    again = split_rows(data, SplitRule(train_size=20, seed=1))
    assert len(again.train) == 20
    assert sorted(again.holdout) == sorted(split.holdout)
    np.testing.assert_array_equal(again.train, split_rows(data, SplitRule(seed=1)).train[:20])


def test_a_stated_rule_comes_before_what_was_planned():
    data, plain = planned(50, layer=np.arange(50) % 10 * 1.0), measured(50, layer=np.arange(50) % 10 * 1.0)
    tail = HoldoutRange.parse("q1:high:0.3")
    for rule in (
        SplitRule(by_purpose=False),
        SplitRule(holdout=0.4),
        SplitRule(split_by=("layer",)),
        SplitRule(holdout_range=tail),
        CalibrationOptions.of(holdout=0.3).split,
    ):
        split, same = split_rows(data, rule), split_rows(plain, rule)
        np.testing.assert_array_equal(split.train, same.train)
        np.testing.assert_array_equal(split.holdout, same.holdout)
        assert split.planned == 0
    assert CalibrationOptions.of(seed=3).split.by_purpose


def test_files_without_poses_to_validate_keep_the_plain_split():
    for purpose in (["train"] * 40, [""] * 40, np.arange(40.0)):
        split = split_rows(measured(40, purpose=purpose), SplitRule())
        np.testing.assert_array_equal(split.holdout, np.random.default_rng(7).permutation(40)[28:])
    assert list(measured(40, purpose=np.arange(40.0)).features) == ["purpose"]
    both = Measurements.concatenate([planned(30, name="a"), measured(40, "b", seed=1)])
    split = split_rows(both, SplitRule())
    assert sorted(split.holdout[:6]) == list(range(0, 30, 5))
    np.testing.assert_array_equal(split.holdout[6:], 30 + np.random.default_rng(7).permutation(40)[28:])
    assert split.planned == 6


def test_purposes_are_no_part_of_what_was_measured():
    assert planned(50).hash() == measured(50).hash()
    assert planned(50).select([5, 6]).purpose.tolist() == ["validate", "train"]


def test_of_many_set_ups_without_training_rows_few_are_named():
    data = measured(40, group=[f"g{k}" for k in range(40)])
    with pytest.raises(InputError, match=r'"g\d+" and 7 others trains'):
        split_rows(data, SplitRule())


def in_pairs(count, name="data"):
    frame = table(count, pair=[f"p{k // 2}" for k in range(count)], distance=1.0)
    return Measurements.from_dataframe(frame.drop(columns=["x", "y", "z"]), name=name)


@pytest.mark.parametrize(("size", "taken"), [(20, 20), (21, 20), (2, 2)])
def test_a_train_size_takes_whole_pairs(size, taken):
    data = in_pairs(60)
    split, whole = split_rows(data, SplitRule(train_size=size)), split_rows(data, SplitRule())
    assert len(split.train) == taken == 2 * distance_count(data.select(split.train))
    assert split.train.tolist() == [row for row in whole.train if row in split.train]
    np.testing.assert_array_equal(split.holdout, whole.holdout)
    places = [min(whole.train.tolist().index(row) for row in (k - k % 2, k - k % 2 + 1)) for k in whole.train]
    first = sorted(set(places))[: taken // 2]
    assert set(split.train // 2) == {whole.train[place] // 2 for place in first}


def test_a_train_size_without_room_for_a_pair_is_refused():
    with pytest.raises(UsageError, match="a train size of 1 holds no whole pair"):
        split_rows(in_pairs(60), SplitRule(train_size=1))


def test_a_train_size_is_filled_with_rows_beside_pairs():
    frame = table(60, pair=["p"] * 2 + [""] * 58, anchor=[""] * 2 + ["ball"] * 58, distance=1.0)
    data = Measurements.from_dataframe(frame.drop(columns=["x", "y", "z"]))
    whole = split_rows(data, SplitRule()).train
    for size in range(1, 41):
        train = split_rows(data, SplitRule(train_size=size)).train
        assert len(train) == size
        assert len({0, 1} & set(train.tolist())) != 1
        if not {0, 1} & set(whole[: size + 1].tolist()):
            np.testing.assert_array_equal(train, whole[:size])


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ((0, True, 0.3), "joint 0 .*counted from 1"),
        ((1, True, 0.0), r"share in \"q1:high:0.0\" is 0.*between 0 and 1"),
        ((1, True, 2.0), "between 0 and 1"),
        ((1.5, True, 0.3), "joint is 1.5. It must be a whole number"),
        ((1, "high", 0.3), "high is 'high'. It must be True or False"),
        ((1, True, "0.3"), "share is '0.3'. It must be a number"),
    ],
)
def test_ranges_that_cannot_be_made(wrong, words):
    with pytest.raises(UsageError, match=words):
        HoldoutRange(*wrong)


def test_every_digit_of_a_range_is_kept():
    tail = HoldoutRange(2, True, 1 / 3)
    assert HoldoutRange.parse(str(tail)) == tail
    options = CalibrationOptions.of(holdout_range=tail)
    assert CalibrationOptions.of(**options.to_dict()) == options
    assert SplitRule(holdout_range=str(tail)).holdout_range == tail
