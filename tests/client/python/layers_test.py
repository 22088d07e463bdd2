"""Jobs that grow layers on walls and split them, as the command does."""
import asyncio
import subprocess

import support
from support import LARGER, VARIMESH

support.need()
import varimesh

LAYERS = varimesh.Layers("all", grow=0.05, layers=4, first=0.005)


class Layers(support.WithServer):
    def test_writes_the_same_bytes_as_the_command(self):
        here, there = self.folder / "here.msh", self.folder / "there.msh"
        flags = ["--wall", "all", "--grow", "0.05", "--layers", "4", "--first", "0.005", "--quiet"]
        subprocess.run([VARIMESH, "optimise", LARGER, "-o", here, *flags], check=True)
        result = self.client.optimise(LARGER, there, layers=LAYERS)
        self.assertEqual(here.read_bytes(), there.read_bytes())
        report = result.metrics.layers
        self.assertEqual(report.layers, 4)
        self.assertEqual(report.elements_after, result.metrics.elements)
        self.assertEqual(result.metrics.elements, report.elements_before + 3 * report.wall_elements)
        self.assertAlmostEqual(report.first_height[0], 0.005, places=9)
        self.assertAlmostEqual(report.grown[1], 0.05)
        self.assertLessEqual(report.full_share, 1)
        self.assertEqual(report.thick.certified.valid, report.elements_before)
        self.assertIsNone(self.client.optimise(LARGER, max_iterations=0).metrics.layers)

    def test_the_client_for_asyncio_has_them_too(self):
        async def optimised():
            async with varimesh.AsyncClient(self.server.address) as client:
                return await client.optimise(LARGER, layers=LAYERS)

        self.assertEqual(asyncio.run(optimised()).metrics.layers.layers, 4)

    def test_what_is_wrong_has_a_sentence(self):
        with self.assertRaisesRegex(varimesh.Refused, "Give two of the number of layers"):
            self.client.submit(LARGER, layers=varimesh.Layers("all", layers=3))
        with self.assertRaisesRegex(varimesh.BadOption, "did you mean 'even'"):
            self.client.submit(LARGER, layers=varimesh.Layers("all", layers=3, first=1, spacing="evn"))
        with self.assertRaisesRegex(varimesh.JobFailed, "There is no wall 'wing'"):
            self.client.optimise(LARGER, layers=varimesh.Layers("wing", layers=3, first=1))


if __name__ == "__main__":
    support.main()
