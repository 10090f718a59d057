"""The JavaScript that recognizes and generates movements in a browser; modules without a build step."""
