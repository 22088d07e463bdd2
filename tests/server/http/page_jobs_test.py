"""The page of --http in a headless Chromium: jobs are watched, cancelled and listed there.
ctest runs it with VARIMESH, VARIMESHD and VARIMESH_SOURCE_DIR in the environment."""
import json
import os
import subprocess
import time
import unittest

from with_page import WithPage

from programs import CASES, ENDLESS, LARGER, MESH, VARIMESHD


class Jobs(WithPage):
    def test_a_job_is_watched_and_cancelled(self):
        job = self.submit(LARGER, *ENDLESS)
        self.open(f"/#/jobs/{job}")
        self.page.wait("/ [0-9]+: .*not certified/.test(document.querySelector('#job .readout')?.textContent)")
        self.page.click("button", "Cancel")
        self.page.click("button", "Cancel: click again")
        self.wait_for_state("cancelled")
        self.assertEqual(self.wait(job, "JOB_STATE_CANCELLED")["state"], "JOB_STATE_CANCELLED")
        self.page.wait("document.querySelectorAll('#pictures .view').length === 2 || document.querySelectorAll('#pictures .view').length === 4")
        self.check_clean()

    def watch_move(self, mesh, drawn, *options):
        """Looks at a job that runs, and waits until what is drawn has changed. `drawn`: JavaScript for that."""
        self.open()
        job = self.submit(mesh, *ENDLESS, *options)
        self.page.value(f"location.hash = '#/jobs/{job}'; 1")
        self.page.wait("!!document.querySelector('#moving .view canvas, #moving .view svg.drawing')", 60)
        self.page.wait(f"(window.first ??= {drawn}) !== {drawn}", 60)
        self.page.value("document.querySelector('#moving .view').focus()")
        time.sleep(2.5)
        self.assertTrue(self.page.value("document.activeElement.matches('#moving .view')"), "the view stays where it is")
        self.ask("POST", f"/v1/jobs/{job}/cancel")
        self.wait_for_state("cancelled")
        self.page.wait("!document.querySelector('#moving') && !!document.querySelector('#pictures .view')", 60)
        self.check_clean()

    def test_a_plane_mesh_moves(self):
        self.watch_move(LARGER, "[...document.querySelectorAll('#moving .drawing path')].map((one) => one.getAttribute('d')).join()")

    def test_a_mesh_in_space_moves(self):
        # Of order 6, so that an iteration takes a while.
        self.watch_move(CASES / "pin_p3.msh", "document.querySelector('#moving .view canvas').toDataURL()", "--order", "6")

    def test_a_mesh_that_does_not_move_is_explained(self):
        """As if another server ran the job."""
        self.open()
        self.page.value("""(() => { const old = window.fetch;
            window.fetch = (to, how) => String(to.url ?? to).endsWith('/mesh') ? Promise.resolve(new Response(null, {status: 204})) : old(to, how); })()""")
        job = self.submit(LARGER, *ENDLESS)
        self.page.value(f"location.hash = '#/jobs/{job}'; 1")
        self.page.wait("/another server of the farm/.test(document.querySelector('#job')?.textContent)", 60)
        self.ask("POST", f"/v1/jobs/{job}/cancel")
        self.wait_for_state("cancelled")
        self.assertNotIn("another server of the farm", self.text("#job"))
        self.check_clean()

    def test_the_list_of_jobs(self):
        for _ in range(22):
            self.submit(MESH, "--time-limit", "5")
        job = self.submit(LARGER, *ENDLESS)
        self.open("/#/jobs")
        rows = "document.querySelectorAll('#jobs tbody tr').length"
        self.page.wait(f"{rows} === 20")
        self.page.value("[1, 2].forEach(() => [...document.querySelectorAll('button')].find((one) => one.textContent === 'Older').click())")
        self.page.wait(f"{rows} === 3")
        self.page.click("button", "Newer")  # Two clicks at once are one.
        self.page.wait(f"{rows} === 20")
        self.page.value("(() => { const one = document.querySelector('#jobs select'); one.value = 2; one.dispatchEvent(new Event('change')); })()")
        self.page.wait(f"{rows} === 1")
        self.assertIn("iteration", self.text("#jobs tbody tr"))
        self.page.click("#jobs button", "Cancel")
        self.page.click("#jobs button", "Cancel: click again")
        self.assertEqual(self.wait(job, "JOB_STATE_CANCELLED")["state"], "JOB_STATE_CANCELLED")
        self.check_clean()

    def test_the_list_keeps_the_focus(self):
        job = self.submit(LARGER, *ENDLESS)
        self.open("/#/jobs")
        self.page.wait("document.querySelector('#jobs tbody tr')?.textContent.includes('iteration')")
        self.page.value("document.querySelector('#jobs tbody a').focus()")
        text = self.text("#jobs tbody tr")
        self.page.wait(f"document.querySelector('#jobs tbody tr').textContent !== {json.dumps(text)}")
        self.assertEqual(self.page.value("document.activeElement.hash ?? ''"), f"#/jobs/{job}")
        self.submit(MESH, "--time-limit", "5")
        self.page.wait("document.querySelectorAll('#jobs tbody tr').length === 2")
        self.assertEqual(self.page.value("document.activeElement.hash ?? ''"), f"#/jobs/{job}")
        self.assertNotIn(job, self.page.value("document.querySelector('#jobs tbody a').hash"), "the newest comes first")
        self.page.click("#jobs tbody tr:last-child button", "Cancel")
        self.page.click("#jobs tbody tr:last-child button", "Cancel: click again")
        self.page.wait("[...document.querySelectorAll('#jobs button')].filter((one) => one.textContent === 'Delete').length === 2")
        self.check_clean()

    def test_one_job_at_a_time(self):
        jobs = [self.submit(LARGER, *ENDLESS) for _ in range(2)]
        self.open(f"/#/jobs/{jobs[0]}")
        for i in (1, 0, 1):
            self.page.value(f"location.hash = '#/jobs/{jobs[i]}'")
        self.page.wait("!!document.querySelector('#state')")
        time.sleep(2)
        self.assertEqual(self.page.value("document.querySelectorAll('#job').length"), 1)
        self.assertIn(jobs[1], self.text("#state"))
        self.check_clean()


class TimeLeft(WithPage):
    def test_is_told_while_a_job_runs_and_no_more_when_it_has_ended(self):
        job = self.submit(LARGER, *ENDLESS)
        self.open()
        self.page.value("""(() => {  // As a server says it that knows how much is left.
          const parse = JSON.parse;
          JSON.parse = (text) => {
            const made = parse(text);
            if (made?.iteration) made.iteration.secondsLeft = 90;
            return made;
          };
        })()""")
        self.page.value(f"location.hash = '#/jobs/{job}'; 1")
        self.page.wait("/ %, about 1 min 30 s left$/.test(document.querySelector('#job .readout')?.textContent)")
        self.ask("POST", f"/v1/jobs/{job}/cancel")
        self.wait_for_state("cancelled")
        text = self.text("#job .readout")
        self.assertNotIn("left", text)
        self.assertIn("smallest scaled Jacobian", text)
        self.check_clean()


class Keeping(WithPage):
    """What the page says about how long jobs are kept, and about the quota."""

    def flags(self):
        tokens = self.folder / "tokens"
        self.token = subprocess.run([VARIMESHD, "token", "ann", "--tokens", tokens], capture_output=True, text=True, timeout=20).stdout.strip()
        return ("--tokens", str(tokens), "--max-bytes-per-owner", "100000", "--max-ended-jobs", "7", "--min-ended-age", "90", "--max-ended-age", "48",
                "--mesh-lifetime", "24")

    def test_is_shown_with_the_jobs(self):
        bearer = {"Authorization": f"Bearer {self.token}"}
        job = self.submit(MESH, env={**os.environ, "VARIMESH_TOKEN": self.token})
        results = self.wait(job, "JOB_STATE_SUCCEEDED", headers=bearer)["results"]
        used = MESH.stat().st_size + sum(int(one["size"]) for one in results)
        info = self.ask("GET", "/v1/info", headers=bearer)[1]
        self.assertEqual(int(info["ownerBytes"]), used)
        self.assertEqual((info["limits"]["maxBytesPerOwner"], info["limits"]["minEndedAge"]), ("100000", "5400s"))
        self.open(f"/#token={self.token}")
        self.page.click("#token button", "Use this token")
        self.open("/#/jobs")
        self.page.wait("!!document.querySelector('#keeping')")
        text = self.text("#keeping")
        self.assertIn("kept for 90 minutes, and after that the 7 that ended last, for 2 days at most. A mesh without a job is kept for 1 day.", text)
        self.assertRegex(text, r"Your meshes and results take [0-9.]+ kB; you may store 100 kB\.$")
        self.check_clean()


if __name__ == "__main__":
    unittest.main()
