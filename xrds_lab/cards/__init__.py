"""What a graphics card saves: `xrds bench device-report`."""
