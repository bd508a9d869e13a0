"""Tables of runs whose numbers can be worked out by head."""
import os
import sys
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import sources
import tables


def run(scene, method, relmse, seed=1, floor=0.0, other=0.5):
    return {"budget": "4spp", "scene": scene, "method": method, "seed": seed, "spp": 4, "relmse": relmse, "smape": other, "flip": other,
            "dissimilarity": other, "floor": floor}


def cells(table, row):
    return [cell.strip() for cell in table.splitlines()[2 + row].split("|")[1:-1]]


class Ratios(unittest.TestCase):
    def of(self, runs):
        return tables.table({"form": "ratios", "baseline": "plain", "candidates": ["good"]}, runs)

    def test_are_geometric_means_over_scenes_with_the_worst_beside(self):
        runs = [run("room", "plain", 1.0), run("room", "good", 0.1), run("hall", "plain", 1.0), run("hall", "good", 0.4)]
        self.assertEqual(cells(self.of(runs), 0)[:5], ["4spp (2 scenes)", "`good`", "0.20", "0.40", "1.00"])

    def test_take_the_references_noise_off_the_mean_of_the_seeds(self):
        # Each seed by itself would be cut off at a share of the floor.
        seeds = [run("room", "good", 0.05, 1, 0.1), run("room", "good", 0.31, 2, 0.1), run("room", "plain", 0.9, 1, 0.1)]
        self.assertEqual(cells(self.of(seeds), 0)[2], "0.10")

    def test_leave_out_what_a_reference_cannot_tell(self):
        noisy = [run("room", "plain", 0.3, floor=0.2), run("room", "good", 0.21, floor=0.2)]
        self.assertEqual(cells(self.of(noisy), 0), ["4spp (0 scenes)", "`good`", *["-"] * 9, "4"])

    def test_are_in_parentheses_where_a_references_noise_is_a_part_of_them(self):
        noisy = [run("room", "plain", 0.6, floor=0.2), run("room", "good", 0.4, floor=0.2)]
        self.assertEqual(cells(self.of(noisy), 0)[2:5], ["0.50", "0.50", "(1.00)"])

    def test_count_the_measures_that_are_better(self):
        runs = [run("room", "plain", 1.0, other=0.1), run("room", "good", 0.1, other=0.2)]
        self.assertEqual(cells(self.of(runs), 0)[-2], "1 of 4")


class Scenes(unittest.TestCase):
    def test_have_the_other_measures_in_parentheses_where_the_reference_is_noisy(self):
        of = {"form": "scenes", "candidates": ["good"]}
        self.assertEqual(cells(tables.table(of, [run("room", "good", 0.1, floor=0.001)]), 0)[2], "9.9e-02 0.500 0.500 0.500")
        self.assertEqual(cells(tables.table(of, [run("room", "good", 0.1, floor=0.02)]), 0)[2], "8.0e-02 (0.500 0.500 0.500)")


class Rows(unittest.TestCase):
    def test_have_quotients_and_differences_of_columns(self):
        columns = [{"name": "ratio", "value": "a / b", "format": "%.1f"}, {"name": "less", "value": "a - b", "format": "%.1f"}]
        table = tables.table({"form": "rows", "key": "name", "columns": columns}, [{"name": "x", "a": 3, "b": 2}])
        self.assertEqual(cells(table, 0), ["x", "1.5", "1.0"])


class Sources(unittest.TestCase):
    def test_are_all_that_a_module_may_use(self):
        below = sources.all_below(["src/reconstruct"])
        self.assertTrue({"src/reconstruct", "src/film", "src/ffi", "ffi", "build.rs"} <= set(below))
        self.assertFalse({"src/render", "src/cli"} & set(below))

    def test_must_exist(self):
        with self.assertRaises(KeyError):
            sources.all_below(["src/nothing"])
        with self.assertRaises(FileNotFoundError):
            sources.of_path("src/nothing")


if __name__ == "__main__":
    unittest.main()
