// A camera of V4L2 without a kernel module: preloaded, every file .../video7 is a USB camera that sends the files
// CAMERA_FRAMES/0.jpg, 1.jpg, ... and then is unplugged. Formats, ranges and roundings are those of common webcams.
//     cc -shared -fPIC -o camera.so v4l2_device.c -ldl
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define BUFFERS 8
#define BUFFER_BYTES (4 << 20)
enum { FORMATS = 2, SIZES = 2, CONTROLS = 8 };
static const __u32 FORMAT[FORMATS] = {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_MJPEG};
static const __u32 WIDTH[SIZES] = {320, 640}, HEIGHT[SIZES] = {240, 480};
static struct { __u32 id; const char *name; int least, most, step, usual, value; } controls[CONTROLS] = {
  {V4L2_CID_EXPOSURE_AUTO, "Auto Exposure", 0, 3, 1, 3, 3},
  {V4L2_CID_EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", 10, 5000, 10, 150, 150},
  {V4L2_CID_GAIN, "Gain", 0, 100, 1, 10, 10},
  {V4L2_CID_AUTO_WHITE_BALANCE, "White Balance, Automatic", 0, 1, 1, 1, 1},
  {V4L2_CID_WHITE_BALANCE_TEMPERATURE, "White Balance Temperature", 2800, 6500, 10, 4600, 4600},
  {V4L2_CID_FOCUS_AUTO, "Focus, Automatic", 0, 1, 1, 1, 1},
  {V4L2_CID_FOCUS_ABSOLUTE, "Focus, Absolute", 0, 250, 5, 0, 0},
  {V4L2_CID_BRIGHTNESS, "Brightness", 0, 255, 1, 128, 128},
};
static int format = 0, size = 0, fps = 30, device = -1, buffers = BUFFERS, next_buffer = 0, sent = 0, memory = -1;

static int opened(const char *path) {
  size_t length = strlen(path);
  if (length < 7 || strcmp(path + length - 7, "/video7")) return -1;
  if (memory < 0) {
    memory = memfd_create("camera", 0);
    if (ftruncate(memory, (off_t)BUFFERS * BUFFER_BYTES)) return -1;
  }
  device = dup(memory);
  return device;
}

#define OPEN(name)                                                                  \
  int name(const char *path, int flags, ...) {                                      \
    va_list rest; va_start(rest, flags); mode_t mode = va_arg(rest, mode_t); va_end(rest); \
    int found = opened(path);                                                       \
    if (found >= 0) return found;                                                   \
    int (*usual)(const char *, int, ...) = dlsym(RTLD_NEXT, #name);                 \
    return usual(path, flags, mode);                                                \
  }
OPEN(open)
OPEN(open64)

static int refused(int reason) { errno = reason; return -1; }

static void fill_format(struct v4l2_pix_format *pixels) {
  pixels->width = WIDTH[size]; pixels->height = HEIGHT[size]; pixels->pixelformat = FORMAT[format];
  pixels->field = V4L2_FIELD_NONE; pixels->bytesperline = format ? 0 : 2 * WIDTH[size];
  pixels->sizeimage = format ? BUFFER_BYTES : 2 * WIDTH[size] * HEIGHT[size];
  pixels->colorspace = V4L2_COLORSPACE_SRGB;
}

static void fill_buffer(struct v4l2_buffer *buffer) {
  buffer->length = BUFFER_BYTES; buffer->m.offset = buffer->index * BUFFER_BYTES;
  buffer->flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
}

static int send_frame(struct v4l2_buffer *buffer) {
  char path[4096];
  snprintf(path, sizeof path, "%s/%d.%s", getenv("CAMERA_FRAMES"), sent, format ? "jpg" : "yuyv");
  FILE *file = fopen(path, "rb");
  if (!file) return refused(ENODEV);
  usleep(1000000 / fps);
  buffer->index = next_buffer;
  next_buffer = (next_buffer + 1) % buffers;
  fill_buffer(buffer);
  char *bytes = mmap(NULL, BUFFER_BYTES, PROT_WRITE, MAP_SHARED, memory, buffer->m.offset);
  buffer->bytesused = fread(bytes, 1, BUFFER_BYTES, file);
  munmap(bytes, BUFFER_BYTES);
  fclose(file);
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  buffer->timestamp.tv_sec = now.tv_sec; buffer->timestamp.tv_usec = now.tv_nsec / 1000;
  buffer->sequence = sent++;
  return 0;
}

static int control(unsigned long request, void *data) {
  __u32 id = *(__u32 *)data;
  for (int i = 0; i < CONTROLS; i++) {
    if (controls[i].id != id) continue;
    struct v4l2_control *value = data;
    if (request == VIDIOC_QUERYCTRL) {
      struct v4l2_queryctrl *asked = data;
      snprintf((char *)asked->name, 32, "%s", controls[i].name);
      asked->type = V4L2_CTRL_TYPE_INTEGER; asked->minimum = controls[i].least; asked->maximum = controls[i].most;
      asked->step = controls[i].step; asked->default_value = controls[i].usual; asked->flags = 0;
    } else if (request == VIDIOC_G_CTRL) {
      value->value = controls[i].value;
    } else {
      int is_automatic = (i == 1 && controls[0].value != 1) || (i == 4 && controls[3].value) || (i == 6 && controls[5].value);
      if (is_automatic) return refused(EACCES);
      if (value->value < controls[i].least || value->value > controls[i].most) return refused(ERANGE);
      controls[i].value = value->value / controls[i].step * controls[i].step;
    }
    return 0;
  }
  return refused(EINVAL);
}

static int answer(unsigned long request, void *data) {
  switch ((__u32)request) {
    case VIDIOC_QUERYCAP: {
      struct v4l2_capability *found = data;
      memset(found, 0, sizeof *found);
      strcpy((char *)found->driver, "uvcvideo"); strcpy((char *)found->card, "Fine Camera: Fine Camera");
      found->device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
      found->capabilities = found->device_caps | V4L2_CAP_DEVICE_CAPS;
      return 0;
    }
    case VIDIOC_ENUM_FMT: {
      struct v4l2_fmtdesc *found = data;
      if (found->type != V4L2_BUF_TYPE_VIDEO_CAPTURE || found->index >= FORMATS) return refused(EINVAL);
      found->pixelformat = FORMAT[found->index];
      return 0;
    }
    case VIDIOC_ENUM_FRAMESIZES: {
      struct v4l2_frmsizeenum *found = data;
      if (found->index >= (found->pixel_format == V4L2_PIX_FMT_MJPEG ? SIZES : 1)) return refused(EINVAL);
      found->type = V4L2_FRMSIZE_TYPE_DISCRETE;
      found->discrete.width = WIDTH[found->index]; found->discrete.height = HEIGHT[found->index];
      return 0;
    }
    case VIDIOC_ENUM_FRAMEINTERVALS: {
      struct v4l2_frmivalenum *found = data;
      if (found->index >= 2) return refused(EINVAL);
      found->type = V4L2_FRMIVAL_TYPE_DISCRETE;
      found->discrete.numerator = 1; found->discrete.denominator = found->index ? 15 : 30;
      return 0;
    }
    case VIDIOC_S_FMT: case VIDIOC_TRY_FMT: {
      struct v4l2_format *asked = data;
      if (asked->type != V4L2_BUF_TYPE_VIDEO_CAPTURE) return refused(EINVAL);
      int wanted_format = asked->fmt.pix.pixelformat == V4L2_PIX_FMT_MJPEG;
      if (request == VIDIOC_S_FMT) {
        format = wanted_format;
        size = format && asked->fmt.pix.width > 320;
      }
      fill_format(&asked->fmt.pix);
      return 0;
    }
    case VIDIOC_G_FMT: fill_format(&((struct v4l2_format *)data)->fmt.pix); return 0;
    case VIDIOC_S_PARM: case VIDIOC_G_PARM: {
      struct v4l2_streamparm *asked = data;
      struct v4l2_fract *time = &asked->parm.capture.timeperframe;
      if (request == VIDIOC_S_PARM && time->numerator)
        fps = time->denominator / time->numerator <= 15 ? 15 : 30;
      asked->parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
      time->numerator = 1; time->denominator = fps;
      return 0;
    }
    case VIDIOC_QUERYCTRL: case VIDIOC_G_CTRL: case VIDIOC_S_CTRL: return control(request, data);
    case VIDIOC_REQBUFS: {
      struct v4l2_requestbuffers *asked = data;
      if (asked->count > BUFFERS) asked->count = BUFFERS;
      if (asked->count) buffers = asked->count;
      next_buffer = 0;
      return 0;
    }
    case VIDIOC_QUERYBUF: fill_buffer(data); return 0;
    case VIDIOC_QBUF: case VIDIOC_STREAMON: case VIDIOC_STREAMOFF: return 0;
    case VIDIOC_DQBUF: return send_frame(data);
    case VIDIOC_G_INPUT: *(int *)data = 0; return 0;
    case VIDIOC_S_INPUT: return 0;
    case VIDIOC_ENUMINPUT: {
      struct v4l2_input *asked = data;
      if (asked->index) return refused(EINVAL);
      asked->type = V4L2_INPUT_TYPE_CAMERA;
      return 0;
    }
    default: return refused(ENOTTY);
  }
}

int ioctl(int descriptor, unsigned long request, ...) {
  va_list rest;
  va_start(rest, request);
  void *data = va_arg(rest, void *);
  va_end(rest);
  struct stat one, other;
  if (memory >= 0 && !fstat(descriptor, &one) && !fstat(memory, &other) && one.st_ino == other.st_ino
      && one.st_dev == other.st_dev)
    return answer(request & 0xffffffff, data);
  int (*usual)(int, unsigned long, ...) = dlsym(RTLD_NEXT, "ioctl");
  return usual(descriptor, request, data);
}
