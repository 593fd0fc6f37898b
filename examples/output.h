/* output.h - files that are there whole or not at all. Include options.h first. Needs POSIX.    SPDX-License-Identifier: MIT OR Unlicense */

#ifndef OUTPUT_H
#define OUTPUT_H

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Keeps the signals that end a program waiting while a temporary file exists, so that none is left behind. They are held in the thread that
   calls: let it be the only one. */
OPTIONS_API void hold_signals(int how)
{
    sigset_t set;

    sigemptyset(&set);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGHUP);
    sigprocmask(how, &set, NULL);
}

/* Finds out before the work whether a file can be written afterwards: by writing an empty one beside it. */
OPTIONS_API bool check_output(const char *path, const char *scene_name)
{
    struct stat status;
    char temporary[4096];
    int file;

    if (strcmp(path, scene_name) == 0) return fail("%s: is the scene; choose another file", path);
    if (stat(path, &status) == 0) {
        if (S_ISDIR(status.st_mode)) return fail("%s: is a folder", path);
        if (!S_ISREG(status.st_mode)) return fail("%s: is not an ordinary file", path);
        if (access(path, W_OK) != 0) return fail("%s: %s", path, strerror(errno));
    }
    if (snprintf(temporary, sizeof temporary, "%s.try.%ld", path, (long)getpid()) >= (int)sizeof temporary)
        return fail("%s: %s", path, strerror(ENAMETOOLONG));
    hold_signals(SIG_BLOCK);
    file = open(temporary, O_WRONLY | O_CREAT | O_EXCL, 0666);
    if (file < 0) fail("%s: %s", path, strerror(errno));
    else { close(file); unlink(temporary); }
    hold_signals(SIG_UNBLOCK);
    return file >= 0;
}

typedef struct { FILE *file; const char *path; char temporary[4096]; } output;

/* Opens a file beside path; false, having said why, and then there is nothing to close. Signals are held until close_output. */
OPTIONS_API bool open_output(output *out, const char *path)
{
    out->path = path;
    if (snprintf(out->temporary, sizeof out->temporary, "%s.new.%ld", path, (long)getpid()) >= (int)sizeof out->temporary)
        return fail("%s: %s", path, strerror(ENAMETOOLONG));
    hold_signals(SIG_BLOCK);
    out->file = fopen(out->temporary, "wb");
    if (out->file) return true;
    fail("%s: %s", path, strerror(errno));
    hold_signals(SIG_UNBLOCK);
    return false;
}

/* Gives it the name that was asked for; not written whole, or not to be closed: removes it, having said so. */
OPTIONS_API bool close_output(output *out, bool written)
{
    if (ferror(out->file)) written = false;
    if (fclose(out->file) != 0) written = false;
    if (written && rename(out->temporary, out->path) != 0) written = false;
    if (!written) {
        fail("%s: cannot write it: %s", out->path, strerror(errno));
        unlink(out->temporary);
    }
    hold_signals(SIG_UNBLOCK);
    return written;
}

#endif /* OUTPUT_H */
