"""The client for asyncio."""
import asyncio
import unittest

import support
from support import LARGER, MESH

support.need()
import numpy as np
import varimesh


class Asynchronous(support.WithServer):
    def test_many_jobs_at_once_give_the_same_result_as_one(self):
        alone = self.client.optimise(MESH)

        async def many():
            async with varimesh.AsyncClient(self.server.address) as client:
                events = []
                results = await asyncio.gather(*(client.optimise(MESH, on_event=events.append) for _ in range(20)))
                return results, events

        results, events = asyncio.run(many())
        for result in results:
            np.testing.assert_array_equal(result.nodes, alone.nodes)
        self.assertGreaterEqual(sum(event.state == "succeeded" for event in events), 20)

    def test_a_job_can_be_watched_and_fetched(self):
        async def one():
            async with varimesh.AsyncClient(self.server.address) as client:
                job = await client.submit(MESH, outputs=["parts"], labels={"for": "async"})
                states = [event.state async for event in job.watch() if event.state]
                self.assertEqual([one.name for one in await client.jobs(labels={"for": "async"})], [job.name])
                return states, await job.fetch(), await client.info(), await client.quality(MESH)

        states, result, info, quality = asyncio.run(one())
        self.assertEqual(states[-1], "succeeded")
        self.assertTrue(result.valid and len(result.nodes) and info.version)
        self.assertEqual(quality.certified.invalid, 2)

    def test_a_watch_can_be_stopped_early(self):
        async def leave(name):
            async with varimesh.AsyncClient(self.server.address) as client:
                async for event in (await client.job(name)).watch():
                    if event.iteration is not None:
                        return event

        with self.running() as job:
            self.assertIsNotNone(asyncio.run(asyncio.wait_for(leave(job.name), 20)))

    def test_a_cancelled_task_cancels_its_job(self):
        async def cancel():
            async with varimesh.AsyncClient(self.server.address) as client:
                begun = asyncio.Event()
                task = asyncio.create_task(client.optimise(
                    LARGER, **support.ENDLESS, labels={"for": "task"}, on_event=lambda event: begun.set()))
                await asyncio.wait_for(begun.wait(), 20)
                task.cancel()
                with self.assertRaises(asyncio.CancelledError):
                    await task
                (job,) = await client.jobs(labels={"for": "task"})
                await asyncio.wait_for(job.wait(), 20)
                return job.state

        self.assertEqual(asyncio.run(cancel()), "cancelled")

    def test_raises_the_same_errors_as_the_client(self):
        async def wrong():
            async with varimesh.AsyncClient(self.server.address) as client:
                await client.job("none")

        with self.assertRaises(varimesh.Refused) as caught:
            asyncio.run(wrong())
        self.assertEqual(caught.exception.reason, "JOB_NOT_FOUND")


if __name__ == "__main__":
    unittest.main(verbosity=2)
