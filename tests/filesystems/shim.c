/* Preloaded library that simulates file systems with missing features. Environment
   variables select the failures:
   NO_FLOCK=ERRNO           flock() fails with ERRNO
   NO_DIRECTORY_SYNC=ERRNO  fsync() of a directory fails with ERRNO
   OTHER_DEVICE=PATH        rename() into or out of PATH fails with EXDEV */
#define _GNU_SOURCE
#include <errno.h>
#include <libgen.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

int flock(int fd, int operation) {
    const char *error = getenv("NO_FLOCK");
    if (!error)
        return (int)syscall(SYS_flock, fd, operation);
    errno = atoi(error);
    return -1;
}

int fsync(int fd) {
    const char *error = getenv("NO_DIRECTORY_SYNC");
    struct stat status;
    if (!error || fstat(fd, &status) != 0 || !S_ISDIR(status.st_mode))
        return (int)syscall(SYS_fsync, fd);
    errno = atoi(error);
    return -1;
}

static int is_under(const char *root, const char *path) {
    char copy[PATH_MAX], real[PATH_MAX];
    strncpy(copy, path, sizeof copy - 1);
    copy[sizeof copy - 1] = 0;
    return realpath(dirname(copy), real) && strncmp(real, root, strlen(root)) == 0;
}

int rename(const char *from, const char *to) {
    const char *other = getenv("OTHER_DEVICE");
    if (other && is_under(other, from) != is_under(other, to)) {
        errno = EXDEV;
        return -1;
    }
    return (int)syscall(SYS_renameat2, -100 /* AT_FDCWD */, from, -100, to, 0);
}
