"""What the tests of the kernel lane are made of."""
