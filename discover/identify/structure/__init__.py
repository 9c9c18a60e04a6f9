"""What an experiment determines of a library, and which laws no shear can tell apart."""
