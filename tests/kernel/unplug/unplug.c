// SPDX-License-Identifier: GPL-2.0
// Unregisters a video node while programs use it, as unplugging a camera does. The kernel refuses
// to remove a module that is in use, so nothing else does this to a node of v4l2loopback.
//
//   insmod unplug.ko node=/dev/video17
//
// It never stays loaded: insmod says "Resource temporarily unavailable" once the node is gone. Do
// not remove v4l2loopback afterwards: it would free that node a second time.
#include <linux/fs.h>
#include <linux/module.h>
#include <media/v4l2-dev.h>

static char *node;
module_param(node, charp, 0);
MODULE_PARM_DESC(node, "path of the video node to unregister");

static int __init unplug(void)
{
	struct file *file;
	struct video_device *device;

	if (!node)
		return -EINVAL;
	file = filp_open(node, O_RDWR | O_NONBLOCK, 0);
	if (IS_ERR(file))
		return PTR_ERR(file);
	device = imajor(file_inode(file)) == VIDEO_MAJOR ? video_devdata(file) : NULL;
	if (device)
		video_unregister_device(device);
	filp_close(file, NULL);
	return device ? -EAGAIN : -ENODEV;
}
module_init(unplug);

MODULE_DESCRIPTION("Unregisters a video node");
MODULE_LICENSE("GPL");
