#define _GNU_SOURCE /* F_OFD_SETLK */
#include "record/output_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/*------------------------------------- locks ----------------------------------------------------*/

static int is_open_file(int fd, const char *path) {
  struct stat mine, there;
  return fstat(fd, &mine) == 0 && stat(path, &there) == 0 && mine.st_dev == there.st_dev &&
         mine.st_ino == there.st_ino;
}

/* 0, or EBUSY. The lock belongs to the open file description, not to the process: two recorders of
 * one program exclude each other, too. Some file systems have no locks: there the result is 0. */
static int lock_byte(int fd) {
  struct flock byte = {
      .l_type = F_WRLCK, .l_whence = SEEK_SET, .l_start = (off_t)1 << 62, .l_len = 1};
  if (fcntl(fd, F_OFD_SETLK, &byte) == 0) return 0;
  return errno == EAGAIN || errno == EACCES ? EBUSY : 0;
}

/* 0, or an errno. EBUSY also if another recorder has renamed its file to the path meanwhile. */
static int open_locked(const char *path, int flags, int *fd) {
  *fd = open(path, O_RDWR | O_CLOEXEC | flags, 0666);
  if (*fd < 0) return errno;
  int why = lock_byte(*fd);
  if (!why && !is_open_file(*fd, path)) why = EBUSY;
  if (!why) return 0;
  close(*fd);
  *fd = -1;
  return why;
}

static void close_fd(int *fd) {
  if (*fd >= 0) close(*fd);
  *fd = -1;
}

static msim_status refuse_output_file(const char *path, int why, msim_error *err) {
  if (why == EBUSY)
    return ms_error_set(err, MSIM_ERR_IO,
                        "%s is in use by another recorder, possibly in another process; close it "
                        "or use another file",
                        path);
  return ms_error_set(err, MSIM_ERR_IO, "%s could not be opened for writing: %s", path,
                      strerror(why));
}

/*------------------------------------- the output file ------------------------------------------*/

static msim_status check_regular_file(const char *path, struct stat *there, msim_error *err) {
  if (stat(path, there) != 0 || S_ISREG(there->st_mode)) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_IO, "%s exists and is not a regular file; use another name",
                      path);
}

msim_status ms_output_file_lock(ms_output_file *file, const msim_allocator *alloc, const char *path,
                                int *taken, msim_error *err) {
  struct stat there = {.st_size = 0};
  *file = (ms_output_file){
      .path = path, .temporary_name = {.alloc = alloc}, .fd = -1, .replaced_fd = -1};
  msim_status status = check_regular_file(path, &there, err);
  if (status) return status;
  *taken = there.st_size > 0;
  int why = open_locked(path, 0, &file->replaced_fd);
  return why == 0 || why == ENOENT ? MSIM_OK : refuse_output_file(path, why, err);
}

msim_status ms_output_file_create(ms_output_file *file, msim_error *err) {
  ms_text_append(&file->temporary_name, "%s.part", file->path);
  if (file->temporary_name.failed) return ms_error_set_memory(err, "the name of a file");
  int why = open_locked(file->temporary_name.data, O_CREAT, &file->fd);
  return why ? refuse_output_file(file->path, why, err) : MSIM_OK;
}

/* Flush the folder that holds the file's name. Overwrites the text. 0, or an errno. */
static int sync_folder(char *path) {
  char *slash = strrchr(path, '/');
  if (slash) slash[1] = '\0';
  int fd = open(slash ? path : ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  int why = fd < 0 || fsync(fd) != 0 ? errno : 0;
  close_fd(&fd);
  return why == EINVAL ? 0 : why; /* the file system cannot do that */
}

msim_status ms_output_file_commit(ms_output_file *file, int sync, msim_error *err) {
  int why = rename(file->temporary_name.data, file->path) == 0 ? 0 : errno;
  if (!why) {
    if (sync) why = sync_folder(file->temporary_name.data);
    ms_text_free(&file->temporary_name);
    close_fd(&file->replaced_fd);
  }
  if (!why) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_IO, "%s could not be created: %s", file->path, strerror(why));
}

void ms_output_file_release(ms_output_file *file) {
  if (file->fd >= 0 && file->temporary_name.data) remove(file->temporary_name.data);
  close_fd(&file->fd);
  close_fd(&file->replaced_fd);
  ms_text_free(&file->temporary_name);
}
