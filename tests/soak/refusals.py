# SPDX-License-Identifier: Apache-2.0
"""What the system refuses: file handles, memory, large files, a reader, space on a disk, the right to write; and clocks
that jump. A command ends well or with a message that says what was missing; what stands under its own name is whole;
and given again with nothing refused, it ends in the results of a command that had everything."""
import os
import resource
import subprocess

from whole import Lost, check_folder

# System clocks that jump, as NTP or a person moves them: every fifth question is answered hours or years off.
CLOCK = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <time.h>
static int asked;
int clock_gettime(clockid_t which, struct timespec* out) {
  static int (*real)(clockid_t, struct timespec*);
  if (!real) *(void**)(&real) = dlsym(RTLD_NEXT, "clock_gettime");
  const int result = real(which, out);
  static const long kSteps[] = {-3600, 86400, -400000000, 500000000, 0};
  if (which == CLOCK_REALTIME) out->tv_sec += kSteps[(asked++ / 5) % 5];
  return result;
}
"""
MEMORY = (40, 70, 100, 130, 160, 190, 220, 260, 300, 400)  # MiB of address space
HANDLES = (3, 4, 5, 6, 8, 10, 14)
FILES = (0, 512, 4096, 20000)  # bytes
DISKS = (0, 16, 48, 128, 256, 512)  # KiB


def limit(which, most):
    return lambda: resource.setrlimit(which, (most, most))


class Refusals:
    def __init__(self, soak):
        self.soak = soak

    def count(self, what):
        self.soak.counts[what] = self.soak.counts.get(what, 0) + 1

    def refused(self, job, what, done, *parts):
        """Whether it was refused: then it said so, with an exit code, and left nothing half-written."""
        where = "%s, %s" % (job.name, what)
        if done.returncode < 0:
            raise Lost("%s: ended by signal %d:\n%s" % (where, -done.returncode, done.stdout))
        if done.returncode > 0 and not any(part.lower() in done.stdout.lower() for part in parts):
            raise Lost("%s: unclear: %s" % (where, done.stdout))
        if job.out.exists():
            check_folder(job.out)
        self.count(what)
        return done.returncode > 0

    def goes_on(self, job, reference, what):
        """Given again, with everything."""
        self.soak.must(job.next())
        check_folder(job.out)
        if job.results(job.out) != reference:
            raise Lost("%s: another result after %s" % (job.name, what))

    def limited(self, job, reference, what, limits, parts):
        for options in limits:
            job.prepare()
            if self.refused(job, what, self.soak.run(job.words, **options), *parts):
                self.goes_on(job, reference, what)
            elif job.results(job.out) != reference:
                raise Lost("%s: another result with %s" % (job.name, what))

    def limits(self, job, reference):
        def each(which, values):
            return [{"preexec_fn": limit(which, v)} for v in values]
        self.limited(job, reference, "few file handles", each(resource.RLIMIT_NOFILE, HANDLES),
                     ("Too many open files", "file handles", "descriptors", "Error 24"))  # the last: the system's loader
        self.limited(job, reference, "little memory", each(resource.RLIMIT_AS, [m << 20 for m in MEMORY]),
                     ("memory", "failed to map segment"))  # the last: the loader
        self.limited(job, reference, "large files", each(resource.RLIMIT_FSIZE, FILES), ("too large",))

    def clocks(self, job, reference):
        library = self.soak.folder / "clock.so"
        if not library.exists():
            subprocess.run(["cc", "-shared", "-fPIC", "-x", "c", "-o", library, "-", "-ldl"], input=CLOCK, text=True, check=True)
        job.prepare()
        self.soak.must(job.words, env=dict(os.environ, LD_PRELOAD=str(library)))
        check_folder(job.out)
        if job.results(job.out) != reference:
            raise Lost("%s: another result with clocks that jump" % job.name)
        self.count("clocks that jump")

    def reader(self, job, reference):
        """A reader that goes away: no message can be written, but what is there is whole."""
        job.prepare()
        with subprocess.Popen(self.soak.command(job.words), stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as child:
            child.stdout.close()
            child.wait()
        if job.out.exists():
            check_folder(job.out)
        self.count("a reader that goes away")
        self.goes_on(job, reference, "a reader that went away")

    def disks(self, job, reference):
        """A disk that fills at any moment, and one that cannot be written: with root only."""
        disk = self.soak.folder / "disk"
        disk.mkdir(exist_ok=True)
        moved = job.at(disk / "out")
        for kib in DISKS:
            subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64m", "tmpfs", disk], check=True)
            try:
                moved.prepare()
                used = int(subprocess.run(["du", "-sk", disk], check=True, stdout=subprocess.PIPE).stdout.split()[0])
                subprocess.run(["mount", "-o", "remount,size=%dk" % max(4, used + kib), disk], check=True)
                full = self.refused(moved, "full disk", self.soak.run(moved.words), "No space left")
                subprocess.run(["mount", "-o", "remount,size=64m", disk], check=True)
                if full:
                    self.goes_on(moved, reference, "a full disk")
            finally:
                subprocess.run(["umount", disk], check=True)
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64m", "tmpfs", disk], check=True)
        try:
            moved.prepare()
            subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
            if not self.refused(moved, "read-only disk", self.soak.run(moved.words), "Read-only file system"):
                raise Lost("%s: it wrote to a disk that cannot be written" % job.name)
        finally:
            subprocess.run(["umount", disk], check=True)

    def all(self, job, reference):
        self.limits(job, reference)
        self.reader(job, reference)
        self.clocks(job, reference)
        if os.geteuid() == 0:
            self.disks(job, reference)
