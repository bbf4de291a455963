#define _GNU_SOURCE /* F_OFD_SETLK */
#include "sim/place.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/*------------------------------------- locks ----------------------------------------------------*/

static int is_same(int fd, const char *path) {
  struct stat mine, there;
  return fstat(fd, &mine) == 0 && stat(path, &there) == 0 && mine.st_dev == there.st_dev &&
         mine.st_ino == there.st_ino;
}

/* 0, or EBUSY. The lock belongs to the open file description, not to the process: two recorders of
 * one program exclude each other, too. Some file systems have no locks: there the result is 0. */
static int lock(int fd) {
  struct flock byte = {
      .l_type = F_WRLCK, .l_whence = SEEK_SET, .l_start = (off_t)1 << 62, .l_len = 1};
  if (fcntl(fd, F_OFD_SETLK, &byte) == 0) return 0;
  return errno == EAGAIN || errno == EACCES ? EBUSY : 0;
}

/* 0, or an errno. EBUSY also if another recorder has renamed its file to the path meanwhile. */
static int open_locked(const char *path, int flags, int *fd) {
  *fd = open(path, O_RDWR | O_CLOEXEC | flags, 0666);
  if (*fd < 0) return errno;
  int why = lock(*fd);
  if (!why && !is_same(*fd, path)) why = EBUSY;
  if (!why) return 0;
  close(*fd);
  *fd = -1;
  return why;
}

static void drop(int *fd) {
  if (*fd >= 0) close(*fd);
  *fd = -1;
}

static msim_status refuse(const char *path, int why, msim_error *err) {
  if (why == EBUSY)
    return ms_fail(err, MSIM_ERR_IO,
                   "%s is being written by another recorder, maybe of another process", path);
  return ms_fail(err, MSIM_ERR_IO, "%s could not be opened for writing: %s", path, strerror(why));
}

/*------------------------------------- the output file ------------------------------------------*/

static msim_status check_kind(const char *path, struct stat *there, msim_error *err) {
  if (stat(path, there) != 0 || S_ISREG(there->st_mode)) return MSIM_OK;
  return ms_fail(err, MSIM_ERR_IO, "%s is there already, and it is not a file", path);
}

msim_status ms_place_claim(ms_place *place, const msim_allocator *alloc, const char *path,
                           int *taken, msim_error *err) {
  struct stat there = {.st_size = 0};
  *place = (ms_place){.path = path, .part = {.alloc = alloc}, .fd = -1, .before = -1};
  msim_status status = check_kind(path, &there, err);
  if (status) return status;
  *taken = there.st_size > 0;
  int why = open_locked(path, 0, &place->before);
  return why == 0 || why == ENOENT ? MSIM_OK : refuse(path, why, err);
}

msim_status ms_place_begin(ms_place *place, msim_error *err) {
  ms_print(&place->part, "%s.part", place->path);
  if (place->part.failed) return ms_fail_memory(err, "the name of a file");
  int why = open_locked(place->part.data, O_CREAT, &place->fd);
  return why ? refuse(place->path, why, err) : MSIM_OK;
}

/* Flush the folder that holds the file's name. Overwrites the text. 0, or an errno. */
static int sync_folder(char *path) {
  char *slash = strrchr(path, '/');
  if (slash) slash[1] = '\0';
  int fd = open(slash ? path : ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  int why = fd < 0 || fsync(fd) != 0 ? errno : 0;
  drop(&fd);
  return why == EINVAL ? 0 : why; /* the file system cannot do that */
}

msim_status ms_place_fill(ms_place *place, int sync, msim_error *err) {
  int why = rename(place->part.data, place->path) == 0 ? 0 : errno;
  if (!why) {
    if (sync) why = sync_folder(place->part.data);
    ms_text_free(&place->part);
    drop(&place->before);
  }
  if (!why) return MSIM_OK;
  return ms_fail(err, MSIM_ERR_IO, "%s could not be created: %s", place->path, strerror(why));
}

void ms_place_leave(ms_place *place) {
  if (place->fd >= 0 && place->part.data) remove(place->part.data);
  drop(&place->fd);
  drop(&place->before);
  ms_text_free(&place->part);
}
