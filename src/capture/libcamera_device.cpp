#include "capture/libcamera_device.h"

#include <libcamera/control_ids.h>
#include <poll.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>

#include "base/clock.h"
#include "capture/libcamera_controls.h"
#include "capture/libcamera_error.h"

namespace loopd {
namespace {

constexpr unsigned kLeastBuffers = 4;  // one is read, one is ready, two are with the device

// The pixel format that is wanted: none for "auto"; an error for a name that is none.
std::variant<std::optional<PixelFormat>, CameraError> wanted_format(const std::string& name) {
  if (name.empty() || name == "auto") return std::optional<PixelFormat>();
  const auto format = pixel_format_from_name(name);
  if (format) return format;
  return lost_camera(CameraFault::kUnsupported,
                     "the pixel format \"" + name +
                         "\" is not known; use auto, or a code such as "
                         "YUYV or MJPG",
                     EINVAL);
}

std::string format_names(const libcamera::StreamFormats& formats) {
  std::string names;
  for (const libcamera::PixelFormat& format : formats.pixelformats())
    names += (names.empty() ? "" : ", ") + format.toString();
  return names.empty() ? "none" : names;
}

std::string size_text(FrameSize size) {
  return std::to_string(size.width_px) + "x" + std::to_string(size.height_px);
}

}  // namespace

CaptureDriver::Opened LibcameraDevice::open(std::shared_ptr<LibcameraManager> manager,
                                            std::shared_ptr<libcamera::Camera> camera,
                                            DevWatch watch, const LibcameraOptions& options) {
  std::unique_ptr<LibcameraDevice> device(
      new LibcameraDevice(std::move(manager), std::move(camera), std::move(watch)));
  Problem problem = device->acquire();
  if (!problem) problem = device->choose(options);
  if (!problem) problem = device->configure(options);
  if (!problem) problem = device->allocate();
  if (!problem) problem = device->start(options);
  if (problem) return *std::move(problem);
  return std::unique_ptr<CaptureDevice>(std::move(device));
}

LibcameraDevice::LibcameraDevice(std::shared_ptr<LibcameraManager> manager,
                                 std::shared_ptr<libcamera::Camera> camera, DevWatch watch)
    : manager_(std::move(manager)),
      camera_(std::move(camera)),
      watch_(std::move(watch)),
      nodes_(manager_->nodes(*camera_)) {
  info_.id = stable_id(*camera_, nodes_);
  usb_ = behind_usb(nodes_);
  // Better to look again at a camera that stayed than to miss that this one went.
  if (nodes_.empty()) nodes_ = video_nodes();
  for (const CameraNode& node : nodes_) node_names_.push_back(node.name);
  info_.name = camera_name(*camera_).model;
  if (info_.name.empty()) info_.name = camera_->id();
  info_.node = camera_->id();
  info_.clock = "unknown";
  camera_->requestCompleted.connect(this, &LibcameraDevice::on_completed);
  camera_->disconnected.connect(this, &LibcameraDevice::on_disconnected);
}

// In this order: no request may be under way when its buffer goes, no buffer be left when the
// camera is released, and no camera when the manager stops.
LibcameraDevice::~LibcameraDevice() {
  if (held_) planes_[*held_].end_read();
  // A camera that has gone must not be stopped: the kernel refuses that, libcamera (0.0.3 at least)
  // then finds its requests still queued, and ends the process. Nothing writes into their buffers
  // any more, so they may go as they are; the manager, which stops next, closes the device.
  const bool gone = has_gone();
  if (started_ && !gone) camera_->stop();
  camera_->requestCompleted.disconnect(this);
  camera_->disconnected.disconnect(this);
  requests_.clear();
  planes_.clear();
  allocator_.reset();
  if (acquired_ && !gone) camera_->release();
  config_.reset();
  // Pipelines of sensors run an algorithm's thread, which only stop() ends; destroying it as it
  // runs ends the process too. Such a camera is not plugged, so that it goes is rare: it is left
  // behind.
  if (started_ && gone && !usb_) new std::shared_ptr<libcamera::Camera>(camera_);
  camera_.reset();
}

LibcameraDevice::Problem LibcameraDevice::acquire() {
  if (board_.fd() < 0) return failed("no descriptor is left to wait for frames", -EMFILE);
  const int status = camera_->acquire();
  if (status < 0) return failed("it cannot be taken", status);
  acquired_ = true;
  return std::nullopt;
}

LibcameraDevice::Problem LibcameraDevice::choose(const LibcameraOptions& options) {
  const auto only = wanted_format(options.format);
  if (const auto* error = std::get_if<CameraError>(&only)) return *error;
  config_ = camera_->generateConfiguration({libcamera::StreamRole::Viewfinder});
  if (!config_ || config_->empty())
    config_ = camera_->generateConfiguration({libcamera::StreamRole::VideoRecording});
  if (!config_ || config_->empty())
    return failed("it offers no stream for viewing or video", -ENOTSUP);
  libcamera::StreamConfiguration& stream = config_->at(0);
  const bool any_size = options.width_px <= 0 || options.height_px <= 0;
  const FrameSize wanted = any_size ? FrameSize{static_cast<int>(stream.size.width & 0xffff),
                                                static_cast<int>(stream.size.height & 0xffff)}
                                    : FrameSize{options.width_px, options.height_px};
  std::vector<FormatOffer> offers = format_offers(stream.formats());
  if (offers.empty())  // a pipeline that lists nothing; what it proposes is what it has
    offers.push_back({stream.pixelFormat.fourcc(), stream.pixelFormat.modifier(), {}, {}, {}, {}});
  const auto choice = choose_format(offers, std::get<0>(only), wanted);
  if (!choice)
    return lost_camera(CameraFault::kUnsupported,
                       "cannot use the camera " + camera_->id() + ": no pixel format of it (" +
                           format_names(stream.formats()) + ") can be read" +
                           (std::get<0>(only) ? " as " + options.format + "; set the format to auto"
                                              : "; use another camera"),
                       ENOTSUP);
  stream.pixelFormat =
      libcamera::PixelFormat(offers[choice->offer].code, offers[choice->offer].modifier);
  stream.size = libcamera::Size(static_cast<unsigned>(choice->size.width_px),
                                static_cast<unsigned>(choice->size.height_px));
  return std::nullopt;
}

LibcameraDevice::Problem LibcameraDevice::configure(const LibcameraOptions& options) {
  libcamera::StreamConfiguration& stream = config_->at(0);
  stream.stride = 0;  // libcamera proposes the stride for what it proposed; ask for the right one
  const unsigned count = options.buffers > 0 ? static_cast<unsigned>(options.buffers)
                                             : std::max(stream.bufferCount, kLeastBuffers);
  stream.bufferCount = std::min<unsigned>(count, CompletionBoard::kMaxBuffers);
  if (config_->validate() == libcamera::CameraConfiguration::Invalid)
    return failed("it refuses " + stream.toString(), -EINVAL);
  const auto format =
      pixel_format_from_drm(stream.pixelFormat.fourcc(), stream.pixelFormat.modifier());
  if (!format)
    return failed("it insists on " + stream.toString() + ", which cannot be read", -ENOTSUP);
  if (!options.format.empty() && options.format != "auto" &&
      *format != pixel_format_from_name(options.format))
    info_.warnings.push_back("the camera gives " + std::string(pixel_format_name(*format)) +
                             " instead of " + options.format);
  const int status = camera_->configure(config_.get());
  if (status < 0) return failed("it cannot be set to " + stream.toString(), status);
  const auto layout = checked_layout(*format, stream.size.width, stream.size.height, stream.stride);
  if (!layout) return failed("it gives frames of impossible size: " + stream.toString(), -EINVAL);
  layout_ = *layout;
  info_.format = layout_.format;
  info_.width_px = layout_.width_px;
  info_.height_px = layout_.height_px;
  const FrameSize given{layout_.width_px, layout_.height_px};
  const FrameSize wanted{options.width_px, options.height_px};
  if (options.width_px > 0 && options.height_px > 0 && given != wanted)
    info_.warnings.push_back("the camera gives " + size_text(given) + " instead of " +
                             size_text(wanted));
  return std::nullopt;
}

LibcameraDevice::Problem LibcameraDevice::allocate() {
  libcamera::Stream* const stream = config_->at(0).stream();
  allocator_ = std::make_unique<libcamera::FrameBufferAllocator>(camera_);
  const int status = allocator_->allocate(stream);
  if (status < 0) return failed("its frame buffers cannot be had", status);
  const auto& buffers = allocator_->buffers(stream);
  const std::size_t count = std::min(buffers.size(), CompletionBoard::kMaxBuffers);
  if (count < 2) return failed("it gives too few frame buffers", -ENOMEM);
  for (std::size_t i = 0; i < count; ++i) {
    if (buffers[i]->planes().empty()) return failed("a frame buffer of it has no plane", -EINVAL);
    const libcamera::FrameBuffer::Plane& plane = buffers[i]->planes().front();
    const std::size_t offset =
        plane.offset == libcamera::FrameBuffer::Plane::kInvalidOffset ? 0 : plane.offset;
    auto mapped = MappedPlane::map(plane.fd.get(), offset, plane.length);
    if (!mapped) return failed(mapped.error().message, -mapped.error().code);
    planes_.push_back(std::move(mapped).value());
    auto request = camera_->createRequest(i);
    if (!request) return failed("it makes no request", -ENOMEM);
    const int added = request->addBuffer(stream, buffers[i].get());
    if (added < 0) return failed("a request takes no buffer", added);
    requests_.push_back(std::move(request));
  }
  return std::nullopt;
}

LibcameraDevice::Problem LibcameraDevice::start(const LibcameraOptions& options) {
  libcamera::ControlList controls(camera_->controls());
  add_controls(camera_->controls(), options.controls, controls, info_.warnings);
  if (options.fps > 0)
    info_.fps = add_frame_rate(camera_->controls(), options.fps, controls, info_.warnings);
  const int status = camera_->start(&controls);
  if (status < 0) return failed("its stream does not start", status);
  started_ = true;
  // Some pipelines (uvcvideo's) pass over what start() is given and read the requests only.
  for (const auto& [id, value] : controls) requests_.front()->controls().set(id, value);
  for (const auto& request : requests_) {
    const int queued = camera_->queueRequest(request.get());
    if (queued < 0) return failed("it takes no request", queued);
    ++queued_;
  }
  return std::nullopt;
}

CaptureDevice::Grab LibcameraDevice::grab(const Interrupt& interrupt, std::int64_t deadline_ns) {
  release();
  while (true) {
    if (board_.disconnected()) lost_ = unplugged();
    if (lost_) return *lost_;
    if (auto frame = newest_frame()) return *frame;
    if (board_.disconnected() || lost_) continue;  // told while the frames were looked at
    if (monotonic_now_ns() >= deadline_ns) return nothing_came();
    switch (wait(interrupt, deadline_ns)) {
      case Wait::kInterrupted:
        return Interrupted{};
      case Wait::kNothing:
        return nothing_came();
      case Wait::kSomething:
        break;
    }
  }
}

void LibcameraDevice::release() {
  if (!held_) return;
  planes_[*held_].end_read();
  requeue(*held_);
  held_.reset();
}

LibcameraDevice::Wait LibcameraDevice::wait(const Interrupt& interrupt, std::int64_t deadline_ns) {
  // A negative descriptor (no watch) is skipped by poll.
  std::array<pollfd, 3> fds{
      {{interrupt.fd(), POLLIN, 0}, {board_.fd(), POLLIN, 0}, {watch_.fd(), POLLIN, 0}}};
  while (true) {
    const std::int64_t left_ns = std::max<std::int64_t>(deadline_ns - monotonic_now_ns(), 0);
    const timespec timeout{left_ns / 1'000'000'000, left_ns % 1'000'000'000};
    const int ready = ::ppoll(fds.data(), fds.size(), &timeout, nullptr);
    if (interrupt.requested()) return Wait::kInterrupted;
    if (ready > 0 && fds[2].revents != 0 && watch_.removed(node_names_)) lost_ = unplugged();
    if (ready > 0) return Wait::kSomething;
    if (ready == 0 && monotonic_now_ns() >= deadline_ns) return Wait::kNothing;
  }
}

std::optional<RawFrame> LibcameraDevice::newest_frame() {
  std::optional<std::size_t> best;
  std::uint64_t passed_over = 0;
  for (std::uint32_t done = board_.take(); done != 0; done &= done - 1) {
    const auto index = static_cast<std::size_t>(std::countr_zero(done));
    --queued_;
    if (requests_[index]->status() != libcamera::Request::RequestComplete) {
      withdraw(-EIO);
    } else if (comes_late(metadata(index).sequence, last_sequence_, requests_.size())) {
      // Seen with a USB camera on a machine that was too busy.
      passed_over += intact(index) ? 1 : 0;
      requeue(index);
    } else {
      best = better(best, index, passed_over);
    }
  }
  if (!best) return std::nullopt;
  RawFrame frame = read(*best);
  frame.passed_over = passed_over;
  return frame;
}

// The better of two frames: intact before damaged, then the newer. The other goes back.
std::optional<std::size_t> LibcameraDevice::better(std::optional<std::size_t> best,
                                                   std::size_t next, std::uint64_t& passed_over) {
  if (!best) return next;
  const std::int32_t ahead = sequence_ahead(metadata(next).sequence, metadata(*best).sequence);
  const bool next_wins = intact(next) != intact(*best) ? intact(next) : ahead > 0;
  const std::size_t other = next_wins ? *best : next;
  passed_over += intact(other) ? 1 : 0;
  requeue(other);
  return next_wins ? next : *best;
}

RawFrame LibcameraDevice::read(std::size_t index) {
  const libcamera::FrameMetadata& meta = metadata(index);
  const auto sensor = requests_[index]->metadata().get(libcamera::controls::SensorTimestamp);
  const auto stamp_ns =
      sensor && *sensor > 0 ? static_cast<std::uint64_t>(*sensor) : meta.timestamp;
  planes_[index].begin_read();
  held_ = index;
  last_sequence_ = meta.sequence;
  const std::size_t used = meta.planes().empty() ? 0 : meta.planes()[0].bytesused;
  RawFrame frame = raw_frame(layout_, planes_[index].bytes(), used);
  frame.damaged = !intact(index);
  frame.sequence = meta.sequence;
  frame.time_ns = clock_.to_monotonic_ns(stamp_ns, clock_pair_now());
  if (frame.time_ns)
    info_.clock = clock_.source() == StampClock::Source::kBoottime ? "boottime" : "monotonic";
  // libcamera defines the sensor's stamp so; that of a buffer it leaves to the kernel's driver.
  info_.instant = sensor ? StampInstant::kStartOfExposure : StampInstant::kUnknown;
  return frame;
}

CaptureDevice::Grab LibcameraDevice::nothing_came() {
  if (nodes_present()) return TimedOut{};
  lost_ = unplugged();
  return *lost_;
}

void LibcameraDevice::on_completed(libcamera::Request* request) {
  board_.finish(static_cast<std::size_t>(request->cookie()));
}

void LibcameraDevice::on_disconnected() { board_.disconnect(); }

const libcamera::FrameMetadata& LibcameraDevice::metadata(std::size_t index) const {
  return requests_[index]->buffers().begin()->second->metadata();
}

bool LibcameraDevice::intact(std::size_t index) const {
  return metadata(index).status == libcamera::FrameMetadata::FrameSuccess;
}

void LibcameraDevice::requeue(std::size_t index) {
  requests_[index]->reuse(libcamera::Request::ReuseBuffers);
  const int status = camera_->queueRequest(requests_[index].get());
  if (status < 0)
    withdraw(status);
  else
    ++queued_;
}

// A request is out of use: libcamera cancelled it, or does not take it again. Without any that is
// left no frame can come.
void LibcameraDevice::withdraw(int status) {
  if (queued_ == 0 && !lost_)
    lost_ = nodes_present() ? failed("it takes no more requests", status) : unplugged();
}

// Looked at anew, as it may have gone since the last grab(); and remembered, as another may have
// come in its place since.
bool LibcameraDevice::has_gone() const {
  const bool told = lost_ && lost_->fault == CameraFault::kUnplugged;
  return told || board_.disconnected() || !nodes_present();
}

bool LibcameraDevice::nodes_present() const {
  return std::all_of(nodes_.begin(), nodes_.end(), [](const CameraNode& node) {
    struct stat status {};
    return ::stat(("/dev/" + node.name).c_str(), &status) == 0 && status.st_rdev == node.number;
  });
}

CameraError LibcameraDevice::failed(const std::string& what, int status) const {
  return libcamera_failure(camera_->id(), what, status);
}

CameraError LibcameraDevice::unplugged() const {
  return lost_camera(CameraFault::kUnplugged,
                     "the camera " + camera_->id() + " has gone away; plug it in again", ENODEV);
}

}  // namespace loopd
