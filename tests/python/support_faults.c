// SPDX-License-Identifier: Apache-2.0
// Preloaded: once armed, the n-th call that changes a file fails with an error or ends the process,
// or the clock of the wall is set back by a day there.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <sys/time.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

static long left = -1;  // calls until the fault; negative: none
static int error_number;
static long calls;
static long set_back_s;

// Arms the n-th call (from 1) with an errno, SIGKILL if that is 0, a clock set back if negative.
void faults_arm(long n, int number) {
  left = n;
  error_number = number;
  calls = 0;
  set_back_s = 0;
}
// Calls since then that change a file.
long faults_calls(void) { return calls; }

static int fails(void) {
  if (left < 0) return 0;
  ++calls;
  if (--left != 0) return 0;
  left = -1;
  if (error_number == 0) raise(SIGKILL);
  if (error_number < 0) {
    set_back_s = 86400;
    return 0;
  }
  errno = error_number;
  return 1;
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

int clock_gettime(clockid_t clock, struct timespec* now) {
  const int status = REAL(clock_gettime)(clock, now);
  if (clock == CLOCK_REALTIME) now->tv_sec -= set_back_s;
  return status;
}
time_t time(time_t* now) {
  struct timespec wall;
  clock_gettime(CLOCK_REALTIME, &wall);
  if (now != NULL) *now = wall.tv_sec;
  return wall.tv_sec;
}
ssize_t write(int fd, const void* data, size_t n) {
  return fd > 2 && fails() ? -1 : REAL(write)(fd, data, n);
}
ssize_t writev(int fd, const struct iovec* parts, int n) {
  return fails() ? -1 : REAL(writev)(fd, parts, n);
}
int fsync(int fd) { return fails() ? -1 : REAL(fsync)(fd); }
int rename(const char* from, const char* to) { return fails() ? -1 : REAL(rename)(from, to); }
int mkdir(const char* path, mode_t mode) { return fails() ? -1 : REAL(mkdir)(path, mode); }

#define OPEN(name)                                              \
  int name(const char* path, int flags, ...) {                  \
    va_list rest;                                               \
    va_start(rest, flags);                                      \
    const mode_t mode = flags & O_CREAT ? va_arg(rest, mode_t) : 0; \
    va_end(rest);                                               \
    if ((flags & O_ACCMODE) != O_RDONLY && fails()) return -1;  \
    return REAL(name)(path, flags, mode);                       \
  }
OPEN(open)
OPEN(open64)
